"""A model as one small program: records that people and tools read, a flat encoding, a compiled kernel, Python source."""
