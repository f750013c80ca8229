/* Prints the actions of a policy by observations that come one after the other. */
#include <stdio.h>
#include "policy.c"

int main(void)
{
    float observation[SEASTAR_SIZE], commands[SEASTAR_LIMBS];
    int action[SEASTAR_NUMBERS];
    struct seastar robot;
    seastar_begin(&robot);
    for (;;) {
        for (int k = 0; k < SEASTAR_SIZE; k++)
            if (scanf("%f", &observation[k]) != 1)
                return 0;
        seastar_act(&robot, observation, action, commands);
        printf("%d\n", action[0]);
    }
}
