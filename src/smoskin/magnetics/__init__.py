"""From displacement to field to Hall reading, and the field's inverse."""
