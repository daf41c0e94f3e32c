"""Best fits of an interpretation, its verdict, and the poses that it leaves open."""
