"""One HTML page on which the stored studies are explored."""
