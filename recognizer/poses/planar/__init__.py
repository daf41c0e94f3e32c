"""The same in the plane, with three degrees of freedom (memo, 4.1)."""
