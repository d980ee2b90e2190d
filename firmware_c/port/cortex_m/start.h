#ifndef START_H
#define START_H

/* Starts UART and timer; interrupts are on from here. */
void port_start(void);

#endif
