"""Evaluation of all people's joints and identities in films of several people."""
