"""Depth-camera models: noise, holes, flying pixels."""
