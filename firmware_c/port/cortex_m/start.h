#ifndef START_H
#define START_H

/* Starts UART and timer; interrupts are on from here. */
void port_start(void);

/* To be called at every turn of the main loop; without it the board restarts after WATCHDOG_MS. */
void port_feed_watchdog(void);

#endif
