"""Motion graphs from spec files to result folders: built, walked by an avatar, and written."""
