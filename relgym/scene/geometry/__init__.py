"""Signed distances and contact normals between bodies: `arrays` (batched, exact) and `fcl` (scene by scene)."""
