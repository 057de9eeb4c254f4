"""Motion graphs from files to folders: plans, building, and outings written for people to see."""
