"""From any skeleton to the character: joints found, rotations carried over, feet on the floor."""
