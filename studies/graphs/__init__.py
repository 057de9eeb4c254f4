"""Studies of motion graphs and of the avatars that walk through them."""
