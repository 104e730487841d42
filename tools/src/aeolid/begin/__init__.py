"""Start from the files somebody has: guess what the channels are, write roles and a case, show what was understood."""
