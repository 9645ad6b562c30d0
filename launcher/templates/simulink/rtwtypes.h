/* Stand-in for the types of Simulink Coder. */
#ifndef RTWTYPES_H
#define RTWTYPES_H
typedef double real_T;
typedef char char_T;
#endif
