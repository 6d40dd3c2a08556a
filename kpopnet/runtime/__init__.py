"""What the programs run on: Hydra entry points, processes, atomic writes, provenance."""
