// A microcontroller for examples/wires.ino: its serial port is a file descriptor, its pins are lines of another.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <poll.h>
#include <unistd.h>

enum { LOW, HIGH, OUTPUT };

int port, pins;

unsigned long millis() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000UL + now.tv_nsec / 1000000UL;
}

void pinMode(int, int) {}

void digitalWrite(int pin, int level) {
  static int levels[16];
  if (levels[pin] == level) return;
  levels[pin] = level;
  dprintf(pins, "%lu %d %d\n", millis(), pin, level);
}

struct {
  void begin(long) {}
  bool available() {
    pollfd waits = {port, POLLIN, 0};
    return poll(&waits, 1, 0) > 0 && (waits.revents & POLLIN);
  }
  char read() {
    char c;
    if (::read(port, &c, 1) != 1) exit(0);
    return c;
  }
  void print(const char *text) {
    if (write(port, text, strlen(text)) < 0) exit(1);
  }
} Serial;

#include "wires.ino"

int main(int, char **arguments) {
  port = atoi(arguments[1]);
  pins = atoi(arguments[2]);
  setup();
  while (true) {
    loop();
    usleep(500);
  }
}
