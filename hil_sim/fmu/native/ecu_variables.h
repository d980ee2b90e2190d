/* References and names of the ECU's variables, as its model description has them. */
#ifndef ECU_VARIABLES_H
#define ECU_VARIABLES_H

enum { ECU_TIME, ECU_RX_DATA, ECU_TX_DATA, ECU_RX_CLOCK, ECU_TX_CLOCK, ECU_NOTIFICATIONS };

#define ECU_RX_DATA_NAME "Can.Rx_Data"
#define ECU_TX_DATA_NAME "Can.Tx_Data"
#define ECU_TX_CLOCK_NAME "Can.Tx_Clock"
#define ECU_NOTIFICATIONS_NAME "Can.BusNotifications"

#define ECU_RX_BYTES 65536u

#endif
