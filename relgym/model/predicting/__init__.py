"""What follows a scene, how right that is, and how right it was."""
