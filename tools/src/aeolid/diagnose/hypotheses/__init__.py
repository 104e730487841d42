"""What a model may lack: the catalogue's entries, the parts they share, forms without a name."""
