"""Models: a mesh becomes faces, edges, vertices and symmetries; an outline, edges (memo, 1.1)."""
