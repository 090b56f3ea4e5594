"""YAML options; found through the entry point group `n2n.conf`."""
