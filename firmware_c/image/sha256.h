/* SHA-256 of FIPS 180-4 over bytes in memory. */
#ifndef SHA256_H
#define SHA256_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SHA256_WORDS 8

/* The digest, its first word first; `length` in bytes. */
void sha256(const uint8_t *bytes, uint32_t length, uint32_t digest[SHA256_WORDS]);

#ifdef __cplusplus
}
#endif

#endif
