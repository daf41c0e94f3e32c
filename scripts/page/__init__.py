"""The page that a recognition or an episode is looked at on."""
