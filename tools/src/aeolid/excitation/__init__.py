"""Design signals that excite a plant before it is recorded, and predict what they will tell of its modes."""
