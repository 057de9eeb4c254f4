"""Characters at run time: hit at any moment, advanced frame by frame."""
