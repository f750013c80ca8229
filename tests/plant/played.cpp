// A microcontroller for examples/wires.ino whose time is played from a script on standard input, a line for each event:
//   go MILLISECONDS   loop() is called every millisecond
//   say HEX           bytes arrive
//   jump MILLISECONDS millis() jumps
//   off MILLISECONDS  no power; then it restarts
// What it does is told on standard output: "pin MILLISECONDS PIN LEVEL", and "said MILLISECONDS LINE".
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <string>

enum { LOW, HIGH, OUTPUT };

uint64_t now = 0;
uint32_t shift = 0xFFFFFFFFu - 60000;  // it comes round after a minute
int levels[16];
std::deque<char> arrived;
std::string said;

unsigned long millis() { return (uint32_t)(now + shift); }

void pinMode(int, int) {}

void digitalWrite(int pin, int level) {
  if (levels[pin] == level) return;
  levels[pin] = level;
  printf("pin %llu %d %d\n", (unsigned long long)now, pin, level);
}

struct {
  void begin(long) {}
  int available() { return arrived.size(); }
  int read() {
    char c = arrived.front();
    arrived.pop_front();
    return (unsigned char)c;
  }
  void print(const char *text) {
    said += text;
    if (said.back() != '\n') return;
    printf("said %llu %s", (unsigned long long)now, said.c_str());
    said.clear();
  }
} Serial;

#include "wires.ino"

int main() {
  static char event[8], data[1 << 16];
  setup();
  while (scanf("%7s %65535s", event, data) == 2) {
    long long number = atoll(data);
    if (!strcmp(event, "say"))
      for (char *byte = data; *byte; byte += 2) {
        unsigned value;
        sscanf(byte, "%2x", &value);
        arrived.push_back(value);
      }
    else if (!strcmp(event, "jump"))
      shift += number;
    else if (!strcmp(event, "go"))
      for (; number > 0; number--, now++) loop();
    else {
      for (int pin = 0; pin < 16; pin++) digitalWrite(pin, LOW);
      now += number;
      arrived.clear();
      setup();
    }
  }
}
