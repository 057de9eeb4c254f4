"""Control by video: compare the silhouette of a person before a camera with the database's."""
