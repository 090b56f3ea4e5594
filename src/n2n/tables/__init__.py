"""The paper's tables: planned, run, kept and rendered beside the published numbers."""
