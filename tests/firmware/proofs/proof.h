/* What CBMC is told: any value of a type, what is taken for granted, and what must follow. */
#ifndef PROOF_H
#define PROOF_H

#include <stdbool.h>
#include <stdint.h>

#define GRANTED(condition) __CPROVER_assume(condition)
#define HOLDS(condition, claim) __CPROVER_assert(condition, claim)

/* A variable of a type without an initializer has any value for CBMC. */
#define ANY(type, name) type name

#endif
