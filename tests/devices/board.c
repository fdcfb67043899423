/* An ATmega328P at 16 MHz in simavr, for Python by ctypes: time goes on only within board_run. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#define HERTZ 16000000
#define PINS 8
#define PORTS "BCD"

typedef struct {
    avr_t *avr;
    avr_irq_t *uart_in;
    uint8_t said[4096];
    int said_count;
    int reset_after; /* the CPU is reset after so many further bytes that it sends; 0: never */
    uint8_t driven[3], driven_high[3]; /* the input pins of each port that something drives, and those it drives high */
    uint64_t high_cycles[PINS], high_since[PINS], edges[PINS]; /* of port B */
} board_t;

static void quiet(struct avr_t *avr, const int level, const char *format, va_list arguments) {
    (void)avr, (void)level, (void)format, (void)arguments;
}

static void no_pause(avr_t *avr, avr_cycle_count_t cycles) { (void)avr, (void)cycles; }

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *param) {
    board_t *board = param;
    (void)irq;
    if (board->said_count < (int)sizeof board->said) board->said[board->said_count++] = (uint8_t)value;
    if (board->reset_after && --board->reset_after == 0) board->reset_after = -1;
}

static void on_pin(struct avr_irq_t *irq, uint32_t value, void *param) {
    board_t *board = param;
    int pin = irq->irq;
    if ((irq->value != 0) == (value != 0)) return;
    board->edges[pin]++;
    if (value) board->high_since[pin] = board->avr->cycle;
    else board->high_cycles[pin] += board->avr->cycle - board->high_since[pin];
}

/* From the firmware's ELF file; NULL where it cannot be read. */
board_t *board_new(const char *path) {
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    avr_global_logger_set(quiet);
    avr_t *avr = avr_make_mcu_by_name("atmega328p");
    if (!avr || elf_read_firmware(path, &firmware)) return NULL;
    board_t *board = calloc(1, sizeof *board);
    board->avr = avr;
    avr_init(avr);
    avr->frequency = HERTZ;
    avr->sleep = no_pause;
    avr->log = LOG_NONE;
    avr_load_firmware(avr, &firmware);
    avr->frequency = HERTZ;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    board->uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), on_byte, board);
    for (int pin = 0; pin < PINS; pin++)
        avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), pin), on_pin, board);
    return board;
}

void board_free(board_t *board) {
    avr_terminate(board->avr);
    free(board);
}

/* A reset from outside or by power: cause is the bit of MCUSR. Memory stays as it is. */
void board_reset(board_t *board, int cause) {
    avr_reset(board->avr);
    board->avr->data[0x54] = (uint8_t)cause;
}

/* The simulator forgets at a reset what drives its inputs; the wires of a real board do not. */
static void drive_again(board_t *board) {
    for (int port = 0; port < 3; port++) {
        uint8_t *pin_register = &board->avr->data[0x23 + 3 * port];
        *pin_register = (*pin_register & ~board->driven[port]) | board->driven_high[port];
    }
}

/* Goes on for so many microseconds; returns whether the CPU still runs. */
int board_run(board_t *board, uint64_t microseconds) {
    avr_t *avr = board->avr;
    uint64_t end = avr->cycle + microseconds * (HERTZ / 1000000);
    while (avr->cycle < end) {
        if (avr->pc == 0) drive_again(board);
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return 0;
        if (board->reset_after < 0) board->reset_after = 0, board_reset(board, 1 << 1);
    }
    return 1;
}

/* Drives an input pin, such as 'D', 2. */
void board_drive(board_t *board, char port, int pin, int high) {
    int place = strchr(PORTS, port) - PORTS;
    board->driven[place] |= 1 << pin;
    board->driven_high[place] = (board->driven_high[place] & ~(1 << pin)) | (high ? 1 << pin : 0);
    avr_ioport_external_t wires = {.name = port, .mask = board->driven[place], .value = board->driven_high[place]};
    avr_ioctl(board->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(port), &wires);
    avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_IOPORT_GETIRQ(port), pin), high);
}

/* A byte arrives at the serial input; with UART_INPUT_FE set, one whose stop bit is missing. */
void board_feed(board_t *board, int byte) { avr_raise_irq(board->uart_in, byte); }

/* What the serial output said since the last call; returns how many bytes. */
int board_said(board_t *board, uint8_t *to) {
    int count = board->said_count;
    memcpy(to, board->said, count);
    board->said_count = 0;
    return count;
}

void board_reset_after(board_t *board, int bytes) { board->reset_after = bytes; }

/* Cycles for which a pin of port B was high so far, and how often it changed. */
uint64_t board_high(board_t *board, int pin) {
    int high = board->avr->data[0x25] >> pin & 1;
    return board->high_cycles[pin] + (high ? board->avr->cycle - board->high_since[pin] : 0);
}

uint64_t board_edges(board_t *board, int pin) { return board->edges[pin]; }

/* The main loop never comes back: an endless loop is put at the end of the flash, and the CPU is there. */
void board_hang(board_t *board, int interrupts_too) {
    avr_t *avr = board->avr;
    uint32_t at = avr->flashend - 1;
    avr->flash[at] = 0xFF, avr->flash[at + 1] = 0xCF; /* rjmp .-2 */
    avr->pc = at;
    avr->state = cpu_Running;
    if (!interrupts_too) avr->sreg[S_I] = 0;
}
