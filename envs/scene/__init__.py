"""The MuJoCo scene: objects, where they are put, the finger."""
