"""What is known of what was touched: contacts, bounds, free space, a support; files of them."""
