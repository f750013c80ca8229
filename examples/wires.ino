// Heats the wires of a seastar robot as lines of text say: see docs/plant.md, and seastar_gym/plant/lines.py for lines.
// One pin for each wire, + and - of every limb, that switches its current.
#include <math.h>
#include <stdint.h>

const int LIMBS = 5;
const int PINS[LIMBS][2] = {{2, 3}, {4, 5}, {6, 7}, {8, 9}, {10, 11}};
const uint32_t SILENCE = 100;        // [ms] without a good line, then all wires are off
const uint32_t LONGEST_PULSE = 120;  // [ms]
const uint32_t SHORTEST_REST = 70;   // [ms] of a wire after its pulse
const bool ANTAGONISTS = false;      // whether + and - of a limb may be hot at once
const float HOTTEST = 100;           // [deg C] that no wire may pass
const float WATER = 20;              // [deg C]
const float STEADY_RISE = 220;       // [K] above the water that constant heating tends to
const float TIME_CONSTANT = 420;     // [ms]
const uint32_t START = 500;          // [ms] that the board takes to start, for which hot wires have cooled
const uint32_t OVERTIME = 5;         // [ms] by which a pulse may be too long
const uint32_t LONGEST_STEP = 20;    // [ms] between two looks at the clock; if it goes on by more, no wire has rested
const unsigned int MOST_BYTES = 64;  // that are read at once

struct Wire {
  bool hot;
  uint32_t begun, pulse;  // [ms]
  uint32_t looked;        // on the clock of heat, when the rise was computed [ms]
  uint32_t rested;        // since the last pulse, at most 1 s [ms]
  float rise;             // above the water [K]
};

Wire wires[LIMBS][2];
char line[64];
unsigned int used = 0;
bool greeted = false, dropping = false;
uint32_t heard = 0, ticked = 0, heat_clock = 0;

float heated(float rise, float milliseconds) {
  return STEADY_RISE + (rise - STEADY_RISE) * exp(-milliseconds / TIME_CONSTANT);
}

// Computes how hot a wire is now; often enough that no clock comes round in between.
void settle(Wire &wire) {
  uint32_t passed = heat_clock - wire.looked;
  wire.looked = heat_clock;
  wire.rise = wire.hot ? heated(wire.rise, passed) : wire.rise * exp(-(float)passed / TIME_CONSTANT);
  wire.rested = wire.hot ? 0 : wire.rested + passed < 1000 ? wire.rested + passed : 1000;
}

void heat(int limb, int wire, uint32_t milliseconds) {
  Wire &one = wires[limb][wire];
  settle(one);
  one.hot = milliseconds > 0;
  one.begun = millis();
  one.pulse = milliseconds;
  digitalWrite(PINS[limb][wire], one.hot ? HIGH : LOW);
}

void stop() {
  for (int limb = 0; limb < LIMBS; limb++)
    for (int wire = 0; wire < 2; wire++) heat(limb, wire, 0);
}

// Ends pulses that are over, and all of them when nobody was heard.
void watch() {
  uint32_t now = millis(), passed = now - ticked, step = passed > LONGEST_STEP ? 0 : passed;
  heat_clock += step;
  ticked = now;
  bool silent = now - heard > SILENCE;
  for (int limb = 0; limb < LIMBS; limb++)
    for (int wire = 0; wire < 2; wire++) {
      Wire &one = wires[limb][wire];
      if (one.hot) one.rise = heated(one.rise, passed - step);
      if (one.hot && (silent || now - one.begun >= one.pulse)) heat(limb, wire, 0);
      if (heat_clock - one.looked > 1000) settle(one);
    }
}

unsigned char checksum(const char *text, unsigned int length) {
  unsigned char sum = 0;
  for (unsigned int k = 0; k < length; k++) sum ^= text[k];
  return sum;
}

void say(const char *text) {
  char end[8];
  snprintf(end, sizeof end, "*%02X\n", checksum(text, strlen(text)));
  Serial.print(text);
  Serial.print(end);
}

void refuse(const char *why) {
  stop();
  say(why);
}

void hello() {
  char answer[16];
  snprintf(answer, sizeof answer, "hello 1 %d", LIMBS);
  say(answer);
}

// Whether a wire may be heated for so long; zero is no pulse, but asks for a wire that has rested, too.
bool may_heat(int limb, int wire, uint32_t milliseconds) {
  Wire &one = wires[limb][wire];
  settle(one);
  if (one.hot || one.rested < SHORTEST_REST || (wires[limb][!wire].hot && !ANTAGONISTS)) return false;
  return !milliseconds || heated(one.rise, milliseconds + OVERTIME) <= HOTTEST - WATER;
}

// A pulse as in "80 +00-0": milliseconds in one to four digits, and a sign for every limb. Heats all wires or none.
bool heats(const char *words) {
  uint32_t milliseconds = 0;
  int digits = 0;
  for (; words[digits] >= '0' && words[digits] <= '9' && digits < 4; digits++)
    milliseconds = 10 * milliseconds + (words[digits] - '0');
  const char *signs = words + digits + 1;
  if (!digits || words[digits] != ' ' || milliseconds > LONGEST_PULSE || strlen(signs) != LIMBS) return false;
  for (int limb = 0; limb < LIMBS; limb++) {
    if (!strchr("+-0", signs[limb])) return false;
    if (signs[limb] != '0' && !may_heat(limb, signs[limb] == '-', milliseconds)) return false;
  }
  for (int limb = 0; limb < LIMBS && milliseconds; limb++)
    if (signs[limb] != '0') heat(limb, signs[limb] == '-', milliseconds);
  return true;
}

// Cuts the checksum from the line; whether it was right, and all bytes were printable.
bool opened() {
  if (used < 3 || line[used - 3] != '*') return false;
  for (unsigned int k = 0; k < used; k++)
    if (line[k] < ' ' || line[k] > '~') return false;
  char sum[3];
  snprintf(sum, sizeof sum, "%02X", checksum(line, used - 3));
  bool right = !strcmp(sum, line + used - 2);
  line[used - 3] = 0;
  return right;
}

void obey() {
  if (!opened()) {
    refuse("error A line was garbled.");
    return;
  }
  heard = millis();
  if (!strncmp(line, "hello ", 6)) {
    stop();
    greeted = !strcmp(line + 6, "1");
    hello();
  } else if (!strcmp(line, "stop")) {
    stop();
  } else if (!strncmp(line, "heat ", 5) && greeted) {
    if (!heats(line + 5)) refuse("error Wires cannot be heated so, or have to rest.");
  } else if (strcmp(line, "beat")) {
    refuse("error There is no such thing to do.");
  }
}

void setup() {
  used = 0;
  greeted = dropping = false;
  heard = ticked = millis();
  for (int limb = 0; limb < LIMBS; limb++)
    for (int wire = 0; wire < 2; wire++) {
      pinMode(PINS[limb][wire], OUTPUT);
      wires[limb][wire].rested = START;
      wires[limb][wire].rise = (HOTTEST - WATER) * exp(-(float)START / TIME_CONSTANT);
    }
  stop();
  Serial.begin(115200);
  hello();
}

void loop() {
  watch();
  for (unsigned int k = 0; k < MOST_BYTES && Serial.available(); k++) {
    char c = Serial.read();
    if (c == '\n') {
      line[used] = 0;
      if (!dropping) obey();
      used = 0;
      dropping = false;
      return;
    }
    if (dropping) continue;
    line[used++] = c;
    if (used == sizeof line - 1) {
      dropping = true;
      refuse("error A line is too long.");
    }
  }
}
