"""Help for whoever writes a preset: every key explained, complaints, a form, differences."""
