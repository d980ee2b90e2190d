/* A port whose functions are the test's. */
#ifndef SCRIPTED_PORT_H
#define SCRIPTED_PORT_H

#include "port.h"

typedef struct {
    bool (*receive)(can_frame_t *frame);
    void (*send)(const can_frame_t *frame);
    uint32_t (*time_ms)(void);
    void (*idle)(uint32_t until_ms);
} scripted_port_t;

void scripted_port_set(const scripted_port_t *port);

#endif
