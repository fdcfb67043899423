/* A panel of nine buttons and four lamps for an edge of enliven, on an ATmega328P at 16 MHz (Arduino Uno, Nano).
 *
 * docs/panel.md has the protocol and the wiring. What is sent is state and never an event, so that a message that
 * noise has destroyed is made good by the next one. There is no heap, and no buffer grows.
 */
#define F_CPU 16000000UL
#define BAUD 38400UL /* bits a second; the divider meets it to 0.2 %, and 115200 only to 2.1 % */

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <util/atomic.h>
#include <util/crc16.h>
#include <util/setbaud.h>

#define VERSION "01" /* of the protocol, two digits */

/* Buttons 1 to 6 are PD2 to PD7 (D2 to D7), 7 to 9 are PC0 to PC2 (A0 to A2); each closes to ground. */
#define BUTTONS 9
#define BUTTONS_D 0xFC
#define BUTTONS_C 0x07
/* The lamps attract, possess, locked and ill are PB1 to PB4 (D9 to D12), lit where high. */
#define LAMPS 4
#define FIRST_LAMP 1
#define ALL_LAMPS (((1 << LAMPS) - 1) << FIRST_LAMP)

#define SLICES 64        /* brightness has so many steps; 8000 slices a second are 125 Hz, which no eye sees */
#define SLICES_A_TICK 16 /* a tick is 2 ms */
#define TICK_MS 2
#define STEADY_TICKS 5   /* a contact counts after 10 ms of rest: it bounces for less, and noise is shorter */
#define BEAT_TICKS (250 / TICK_MS)
#define SILENT_TICKS (1000 / TICK_MS) /* four beats of the edge are missing */

#define LONGEST 24 /* bytes of a body with its checksum; what is longer is noise */
#define RING 64    /* bytes, a power of two; more than two messages */

typedef struct {
    volatile uint8_t bytes[RING];
    volatile uint8_t head, tail; /* written at head by one side, read at tail by the other */
} Ring;

static Ring received, sending;
static volatile uint8_t ticks_due;
static volatile uint8_t levels[LAMPS]; /* 0 to SLICES */
static uint8_t reset_cause; /* the bits of MCUSR; zero where a boot loader has cleared them */

static void put(Ring *ring, uint8_t byte) { /* where it is full a byte is lost, and its message with it */
    uint8_t next = (ring->head + 1) % RING;
    if (next == ring->tail) return;
    ring->bytes[ring->head] = byte;
    ring->head = next;
}

static uint8_t take(Ring *ring) {
    uint8_t byte = ring->bytes[ring->tail];
    ring->tail = (ring->tail + 1) % RING;
    return byte;
}

static uint8_t room(const Ring *ring) { return (uint8_t)(ring->tail - ring->head - 1) % RING; }

ISR(USART_RX_vect) {
    bool broken = UCSR0A & (_BV(FE0) | _BV(DOR0));
    uint8_t byte = UDR0;
    put(&received, broken ? 0 : byte); /* a zero is in no message, so the checksum fails */
}

ISR(USART_UDRE_vect) {
    UDR0 = take(&sending);
    if (sending.head == sending.tail) UCSR0B &= ~_BV(UDRIE0);
}

ISR(TIMER0_COMPA_vect) {
    static uint8_t slice;
    uint8_t lit = 0;
    for (uint8_t lamp = 0; lamp < LAMPS; lamp++)
        if (levels[lamp] > slice) lit |= 1 << (FIRST_LAMP + lamp);
    PORTB = (PORTB & ~ALL_LAMPS) | lit;
    slice = (slice + 1) % SLICES;
    if (slice % SLICES_A_TICK == 0) ticks_due++;
}

/* --- messages: $BODY*CRC and a line feed, the checksum as four hexadecimal digits --- */

static char digit(uint8_t value) { return value < 10 ? '0' + value : 'A' + value - 10; }

static void hex(char *to, uint16_t value) {
    for (uint8_t i = 4; i--; value >>= 4) to[i] = digit(value & 0xF);
}

static uint16_t checksum(const char *body, uint8_t length) {
    uint16_t crc = 0;
    while (length--) crc = _crc_xmodem_update(crc, *body++);
    return crc;
}

/* Sends a whole message or none: half of one would be noise. */
static void say(const char *body, uint8_t length) {
    char crc[4];
    if (room(&sending) < length + 7) return;
    hex(crc, checksum(body, length));
    put(&sending, '$');
    while (length--) put(&sending, *body++);
    put(&sending, '*');
    for (uint8_t i = 0; i < 4; i++) put(&sending, crc[i]);
    put(&sending, '\n');
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { UCSR0B |= _BV(UDRIE0); }
}

static void say_hello(void) {
    uint8_t why = reset_cause;
    char hello[] = "H" VERSION "?";
    hello[3] = why & _BV(PORF) ? 'P' : why & _BV(WDRF) ? 'W' : why & _BV(BORF) ? 'B' : why & _BV(EXTRF) ? 'E' : '?';
    say(hello, 4);
}

/* --- lamps --- */

static char shown[LAMPS + 1] = "----";
static uint16_t silent_for = SILENT_TICKS; /* ticks since the edge spoke */

static uint8_t breath(uint16_t tick) { /* 4 s, squared as the eye takes brightness, never quite dark */
    uint8_t step = tick / 16 % 128;
    uint8_t up = step < 64 ? step : 127 - step;
    return 1 + up * up / 64;
}

static void light(uint16_t tick) {
    for (uint8_t lamp = 0; lamp < LAMPS; lamp++) {
        uint8_t level = 0;
        if (silent_for >= SILENT_TICKS) level = tick % 1024 < 50 ? SLICES : 0; /* all flash shortly, every 2 s */
        else if (shown[lamp] == 'S') level = SLICES;
        else if (shown[lamp] == 'B') level = breath(tick);
        else if (shown[lamp] == 'F') level = tick % 256 < 128 ? SLICES : 0; /* twice a second */
        levels[lamp] = level;
    }
}

/* --- what the edge says --- */

static void obey(const char *body, uint8_t length) {
    if (length == 1 && body[0] == '?') say_hello();
    if (length == 1 + LAMPS && body[0] == 'L') {
        memcpy(shown, body + 1, LAMPS);
        silent_for = 0;
    }
}

static void listen(void) {
    static char line[LONGEST];
    static uint8_t length = LONGEST + 1; /* LONGEST + 1: no message has begun */
    char crc[4];
    while (received.head != received.tail) {
        char byte = take(&received);
        if (byte == '$') {
            length = 0;
        } else if (byte == '\n' && length <= LONGEST) {
            if (length > 5 && line[length - 5] == '*') {
                hex(crc, checksum(line, length - 5));
                if (!memcmp(crc, line + length - 4, 4)) obey(line, length - 5);
            }
            length = LONGEST + 1;
        } else if (length < LONGEST) {
            line[length++] = byte;
        } else {
            length = LONGEST + 1;
        }
    }
}

/* --- buttons --- */

static uint8_t counts[BUTTONS]; /* presses since the start, modulo 16 */
static uint16_t beats;          /* quarters of a second since the start; 4.5 h, then from zero */

static uint16_t contacts(void) {
    return (~PIND & BUTTONS_D) >> 2 | (~PINC & BUTTONS_C) << 6;
}

/* Whether a button went down: its contact differs from what it was for STEADY_TICKS in a row. */
static bool pressed(void) {
    static uint16_t down;
    static uint8_t differs[BUTTONS];
    static bool started;
    uint16_t now = contacts();
    bool any = false;
    if (!started) down = now; /* what is held at the start is no press */
    started = true;
    for (uint8_t i = 0; i < BUTTONS; i++) {
        uint16_t bit = 1 << i;
        differs[i] = (now ^ down) & bit ? differs[i] + 1 : 0;
        if (differs[i] < STEADY_TICKS) continue;
        down ^= bit;
        differs[i] = 0;
        if (!(down & bit)) continue;
        counts[i] = (counts[i] + 1) % 16;
        any = true;
    }
    return any;
}

static void say_presses(void) {
    char body[5 + BUTTONS] = "P";
    hex(body + 1, beats);
    for (uint8_t i = 0; i < BUTTONS; i++) body[5 + i] = digit(counts[i]);
    say(body, sizeof body);
}

/* --- once, and for ever --- */

static void start(void) {
    wdt_enable(WDTO_250MS); /* first of all: after its own reset the watchdog runs on, at 16 ms */
    reset_cause = MCUSR;
    MCUSR = 0;
    DDRB = ALL_LAMPS;
    PORTD = BUTTONS_D; /* pull-ups */
    PORTC = BUTTONS_C;
    UBRR0 = UBRR_VALUE;
    UCSR0A = USE_2X ? _BV(U2X0) : 0;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00); /* eight bits, no parity, one stop bit */
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    TCCR0A = _BV(WGM01);
    TCCR0B = _BV(CS01); /* 2 MHz */
    OCR0A = 249;        /* 8000 slices a second */
    TIMSK0 = _BV(OCIE0A);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
}

int main(void) {
    uint16_t tick = 0, beat_in = BEAT_TICKS;
    start();
    say_hello();
    say_presses();
    for (;;) {
        sleep_mode();
        listen();
        if (!ticks_due) continue;
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { ticks_due--; }
        wdt_reset(); /* only here: both this loop and the clock must live */
        tick++;
        if (silent_for < SILENT_TICKS) silent_for++;
        light(tick);
        bool beat = --beat_in == 0;
        if (beat) beats++, beat_in = BEAT_TICKS;
        if (pressed() || beat) say_presses();
    }
}
