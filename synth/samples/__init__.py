"""Training samples: sampling, observation through a sensor model, storage as shards."""
