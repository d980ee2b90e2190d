#include "scripted_port.h"

static scripted_port_t scripted;

void scripted_port_set(const scripted_port_t *port)
{
    scripted = *port;
}

bool port_receive(can_frame_t *frame)
{
    return scripted.receive(frame);
}

void port_send(const can_frame_t *frame)
{
    scripted.send(frame);
}

uint32_t port_time_ms(void)
{
    return scripted.time_ms();
}

void port_idle(uint32_t until_ms)
{
    scripted.idle(until_ms);
}
