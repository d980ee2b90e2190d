/* The boot stage, linked on its own, as bytes in front of the application. */
    .section .boot_image, "a"
    .incbin "boot.bin"
