"""A model as one small program: records to read, a flat encoding, a compiled kernel, Python source."""
