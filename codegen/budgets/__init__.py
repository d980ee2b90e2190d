"""What a built image needs of a microcontroller: flash, RAM and stack, held against limits."""
