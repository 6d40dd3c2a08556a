"""Evaluation of everybody's joints and identities in films of several people."""
