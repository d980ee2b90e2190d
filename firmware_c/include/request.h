/* What a charger asks for, and whether the ECU can do it. */
#ifndef REQUEST_H
#define REQUEST_H

#include <stdbool.h>

#include "codec.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Whether a request is known and its numbers make a charge. The mode counts only where the optional
 * message asks for one; a charge by time needs the time too. */
bool request_is_valid(const codec_measurement_t *asked, bool has_mode, float max_soc);

#ifdef __cplusplus
}
#endif

#endif
