"""Training of the networks, and fitting of the body model's shape."""
