"""Control by video: silhouettes of a person before a camera against those of the database."""
