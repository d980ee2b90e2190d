/* The application of the microcontroller ports. */
#include "calibration.h"
#include "ecu_loop.h"
#include "start.h"

int main(void)
{
    static ecu_loop_t loop;
    ecu_loop_init(&loop, &BMS_DEFAULT_CALIBRATION);
    port_start();
    for (;;) {
        ecu_loop_turn(&loop);
    }
}
