"""Show what nodes stream while they stream it: one set of facts for a page on the loopback and for the terminal."""
