"""Protocols: how a prediction is compared with a reference, to the letter of a publication."""
