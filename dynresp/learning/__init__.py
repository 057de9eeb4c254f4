"""Learning which reaction the oracle would choose: training, and judging what was trained."""
