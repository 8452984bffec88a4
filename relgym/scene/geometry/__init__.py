"""Signed distances and contact normals of bodies: `arrays` (batched, exact), `fcl` (scene by scene)."""
