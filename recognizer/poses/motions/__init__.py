"""Small turns and shifts of a pose, and how far directions may be turned."""
