/* The ECU as a process of Linux on a SocketCAN interface. */
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "calibration.h"
#include "content.h"
#include "ecu_loop.h"
#include "port.h"
#include "socketcan.h"

#define MS_PER_S 1000.0
#define LONGEST_WAIT_MS 100
#define LONGEST_SILENCE_S 1e6
#define DEFAULT_SILENCE_S 5.0

/* A pause between the frames of a plant that has begun before the ECU. */
#define GAP_MS 50
#define LONGEST_START_FRAMES 1000

enum { EXIT_DONE = 0, EXIT_CHECK_FAILED = 1, EXIT_WRONG_USE = 2 };

typedef struct {
    const char *interface;
    uint32_t silence_ms;
} arguments_t;

static socketcan_t bus;
static uint32_t frames_heard; /* when the port last waited */
static uint32_t last_heard_ms;
static uint32_t silent_ms;
static volatile sig_atomic_t is_stopped;

bool port_receive(can_frame_t *frame)
{
    return socketcan_receive(&bus, frame);
}

void port_send(const can_frame_t *frame)
{
    socketcan_send(&bus, frame);
}

uint32_t port_time_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000u + (uint32_t)(now.tv_nsec / 1000000L);
}

/* The place to measure silence, which begins with the first frame: called when no frame waits. */
void port_idle(uint32_t until_ms)
{
    const uint32_t now_ms = port_time_ms();
    const int32_t left_ms = (int32_t)(until_ms - now_ms);
    if ((frames_heard != bus.received) || (bus.received == 0u)) {
        frames_heard = bus.received;
        last_heard_ms = now_ms;
    }
    silent_ms = now_ms - last_heard_ms;
    if (left_ms > 0) {
        socketcan_wait(&bus, (left_ms < LONGEST_WAIT_MS) ? (int)left_ms : LONGEST_WAIT_MS);
    }
}

static void stop(int number)
{
    (void)number;
    is_stopped = 1;
}

static bool parse_silence(const char *text, uint32_t *silence_ms)
{
    char *end;
    const double silence_s = strtod(text, &end);
    if ((end == text) || (*end != '\0') ||
        !((silence_s >= 0.1) && (silence_s <= LONGEST_SILENCE_S))) {
        return false;
    }
    *silence_ms = (uint32_t)(silence_s * MS_PER_S);
    return true;
}

static bool parse(int count, char **words, arguments_t *arguments)
{
    *arguments = (arguments_t){ NULL, (uint32_t)(DEFAULT_SILENCE_S * MS_PER_S) };
    for (int i = 1; i < count; i++) {
        if ((strcmp(words[i], "--silence-s") == 0) && (i + 1 < count)) {
            i++;
            if (!parse_silence(words[i], &arguments->silence_ms)) {
                fprintf(stderr, "bms_ecu: --silence-s '%s': not a time in s from 0.1 to %g\n",
                        words[i], LONGEST_SILENCE_S);
                return false;
            }
        } else if ((words[i][0] != '-') && (arguments->interface == NULL)) {
            arguments->interface = words[i];
        } else {
            arguments->interface = NULL;
            break;
        }
    }
    if (arguments->interface == NULL) {
        fprintf(stderr, "bms_ecu: wrong use; write bms_ecu INTERFACE [--silence-s N], for example "
                        "bms_ecu vcan0 --silence-s 5\n");
    }
    return arguments->interface != NULL;
}

static void say_failed(const char *interface)
{
    const char *remedy = "'ip link' tells its state";
    if (bus.error == EAFNOSUPPORT) {
        remedy = "this kernel has no CAN, run the command inside tools/vcan_guest.sh";
    } else if (bus.error == ENODEV) {
        remedy = "'ip link' lists the interfaces, and tools/vcan_guest.sh provides vcan0";
    } else if (bus.error == ENETDOWN) {
        remedy = "bring it up with 'ip link set dev INTERFACE up'";
    }
    fprintf(stderr, "bms_ecu: bus '%s': %s; %s\n", interface, strerror(bus.error), remedy);
}

/* A period that began before the ECU listened passes, so that the first one is whole. */
static void await_gap(void)
{
    can_frame_t frame;
    for (uint32_t i = 0u; i < LONGEST_START_FRAMES; i++) {
        socketcan_wait(&bus, GAP_MS);
        if (!socketcan_receive(&bus, &frame)) {
            break;
        }
    }
    bus.received = 0u;
}

int main(int count, char **words)
{
    static ecu_loop_t loop;
    arguments_t arguments;
    if (!parse(count, words, &arguments)) {
        return EXIT_WRONG_USE;
    }
    const struct sigaction action = { .sa_handler = stop };
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    if (!socketcan_open(&bus, arguments.interface)) {
        say_failed(arguments.interface);
        return EXIT_WRONG_USE;
    }
    await_gap();
    printf("ECU on %s: listening\n", arguments.interface);
    (void)fflush(stdout);
    const bms_start_t start = {
        .calibration_content = content_of_calibration(&BMS_DEFAULT_CALIBRATION),
    };
    ecu_loop_init(&loop, &BMS_DEFAULT_CALIBRATION);
    bms_tell_start(&loop.bms, &start);
    while (!is_stopped && (bus.error == 0) && (silent_ms < arguments.silence_ms)) {
        ecu_loop_turn(&loop);
    }
    const uint32_t unread = socketcan_unread(&bus);
    printf("ECU on %s: %" PRIu32 " frames received, %" PRIu32 " steps, frames lost: %" PRIu32
           " unread, %" PRIu32 " unsent\n",
           arguments.interface, bus.received, loop.bms.periods, unread, bus.unsent);
    if (bus.error != 0) {
        say_failed(arguments.interface);
        return EXIT_WRONG_USE;
    }
    return ((unread > 0u) || (bus.unsent > 0u)) ? EXIT_CHECK_FAILED : EXIT_DONE;
}
