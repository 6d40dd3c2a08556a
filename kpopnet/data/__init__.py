"""Training data of the networks: shards on disk, observations, crops in a metric cube, batches."""
