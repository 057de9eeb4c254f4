"""Learning which reaction the full search would choose: training, and judging what was trained."""
