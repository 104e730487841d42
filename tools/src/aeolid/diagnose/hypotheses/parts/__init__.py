"""What entries share: the types of an entry, places of attachment, roles, filters, modes."""
