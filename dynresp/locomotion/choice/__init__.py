"""Control by choice: the user picks one of a few offered actions."""
