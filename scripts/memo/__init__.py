"""The memo's experiments rerun (`palpate reproduce`)."""
