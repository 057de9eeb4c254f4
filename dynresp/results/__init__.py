"""The result folder: file names, JSON, and which files dynresp may write and remove in it."""
