"""Training data in bulk: plans, drawing, labelling by many processes, Parquet shards, reading."""
