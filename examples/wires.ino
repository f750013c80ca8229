// Heats the wires of a seastar robot as lines of text say: see "Lines" in docs/plant.md.
// One pin for each wire, + and - of every limb, that switches its current.

const int LIMBS = 5;
const int PINS[LIMBS][2] = {{2, 3}, {4, 5}, {6, 7}, {8, 9}, {10, 11}};
const unsigned long SILENCE = 100;        // [ms] without a good line, then all wires are off
const unsigned long LONGEST_PULSE = 120;  // [ms]

char line[64];
unsigned int used = 0;
bool greeted = false, hot[LIMBS][2];
unsigned long heard = 0, begun[LIMBS][2], pulse[LIMBS][2];

void heat(int limb, int wire, unsigned long milliseconds) {
  hot[limb][wire] = milliseconds > 0;
  begun[limb][wire] = millis();
  pulse[limb][wire] = milliseconds;
  digitalWrite(PINS[limb][wire], hot[limb][wire] ? HIGH : LOW);
}

void stop() {
  for (int limb = 0; limb < LIMBS; limb++)
    for (int wire = 0; wire < 2; wire++) heat(limb, wire, 0);
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

// A pulse as in "heat 80 +00-0": milliseconds, and a sign for every limb.
bool heats(char *words) {
  char *signs;
  unsigned long milliseconds = strtoul(words, &signs, 10);
  if (signs == words || *signs++ != ' ' || milliseconds > LONGEST_PULSE || strlen(signs) != LIMBS) return false;
  for (int limb = 0; limb < LIMBS; limb++)
    if (!strchr("+-0", signs[limb])) return false;
  for (int limb = 0; limb < LIMBS; limb++)
    if (signs[limb] != '0') heat(limb, signs[limb] == '-', milliseconds);
  return true;
}

void obey() {
  char *star = strrchr(line, '*');
  if (!star || strlen(star) != 3 || strtoul(star + 1, 0, 16) != checksum(line, star - line)) {
    refuse("error A line was garbled.");
    return;
  }
  *star = 0;
  heard = millis();
  if (!strncmp(line, "hello ", 6)) {
    char answer[32];
    greeted = !strcmp(line + 6, "1");
    snprintf(answer, sizeof answer, "hello 1 %d", LIMBS);
    say(answer);
  } else if (!strcmp(line, "stop")) {
    stop();
  } else if (strcmp(line, "beat") && !(greeted && !strncmp(line, "heat ", 5) && heats(line + 5))) {
    refuse("error There is no such thing to do.");
  }
}

void setup() {
  for (int limb = 0; limb < LIMBS; limb++)
    for (int wire = 0; wire < 2; wire++) pinMode(PINS[limb][wire], OUTPUT);
  stop();
  Serial.begin(115200);
}

void loop() {
  while (Serial.available()) {
    char c = Serial.read();
    if (c != '\n' && used < sizeof line - 1) {
      line[used++] = c;
    } else if (c == '\n') {
      line[used] = 0;
      used = 0;
      obey();
    }
  }
  if (millis() - heard > SILENCE) stop();
  for (int limb = 0; limb < LIMBS; limb++)
    for (int wire = 0; wire < 2; wire++)
      if (hot[limb][wire] && millis() - begun[limb][wire] >= pulse[limb][wire]) heat(limb, wire, 0);
}
