/* Stands in for Simulink Coder's header, which registers the S-function in generated code. */
#ifndef CG_SFUN_H
#define CG_SFUN_H
extern int stand_in_registered;
#endif
