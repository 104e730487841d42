"""What `import aeolid` offers: recordings, models, validations, simulations, diagnoses; a module holds one of them."""
