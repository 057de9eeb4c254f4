"""From any skeleton to the character: find joints, carry over rotations, put feet on the floor."""
